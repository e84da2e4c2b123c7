"""`python -m service` is `etude`."""

from service.cli import main

if __name__ == "__main__":
    main()

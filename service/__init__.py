"""The daemon, its sessions and the command line."""

import os

# Before NumPy is loaded here or in a child: threads that wait for each other spin, beside a loop that must be punctual.
for _threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")

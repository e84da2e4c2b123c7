"""The stand-in's CAN buses: frame bits, arbitration, queues, and the sockets that a host connects to."""

"""The rclpy nodes: thin, one process each."""

import os

# Before numpy is imported: the matrices are far too small to gain from several threads, whose
# waiting for each other costs a process its answers on a busy machine.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

"""Training, evaluation and export of the far detectors; the only package that may import torch, and only late."""

"""Evaluation of the engines on recordings with ground truth and on the experiments of the paper."""

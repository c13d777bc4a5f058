"""Traced functions and loops on GPUs: one thread for each state, by the NVPTX back end of LLVM and the CUDA driver."""

"""One scene run with many parameters, on many processes or machines. No result is lost when a process dies."""

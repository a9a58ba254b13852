"""One scene run with many parameters, on many processes or machines; nothing is lost when something dies."""

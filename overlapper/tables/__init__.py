"""The results of a simulation: its frames as tables in files, pages and summaries."""

"""What a simulation leaves behind: its frames as tables in files, pages and summaries."""

"""What all benchmarks share: commands, result files, clocks, processes, peers, pages and figures."""

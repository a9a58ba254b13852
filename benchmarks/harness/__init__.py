"""The harness of all benchmarks: commands, result files, clocks, processes, peers, pages and figures."""

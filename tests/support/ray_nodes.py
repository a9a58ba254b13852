"""A Ray cluster of two nodes, or so many, of one CPU each on this machine: python ray_nodes.py [NODES]

It prints its address. A line "kill" on standard input kills a node that is not the head, with all its processes; the
answer is the line "killed". The end of the input ends the cluster.
"""

import os
import sys


def main(nodes=2):
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        others = [cluster.add_node(num_cpus=1) for _ in range(nodes - 1)]
        cluster.wait_for_nodes()
        print(cluster.address, flush=True)
        for line in sys.stdin:
            if line == "kill\n":
                cluster.remove_node(others.pop(), allow_graceful=False)
                print("killed", flush=True)
    finally:
        cluster.shutdown()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

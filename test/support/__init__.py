"""What tests share: naive twins of the kernels, maps and problems, and planner processes with their clients."""

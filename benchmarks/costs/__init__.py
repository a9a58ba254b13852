"""What single features of the package cost, and what they survive."""

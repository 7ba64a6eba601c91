"""What people bring: recordings in every container with every fault, read right or refused."""

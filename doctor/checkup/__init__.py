"""What the program `doctor` is made of: readers of bags and topics, and checks, which are functions of arrays."""

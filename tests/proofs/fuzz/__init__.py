"""Standing fuzz: hostile files, requests and arrays against everything that reads what comes from outside."""

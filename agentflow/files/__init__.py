"""Files and folders that outlive the process that writes them, and files that people write."""

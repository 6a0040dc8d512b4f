"""The workflow `external`: any agent program designs machines, in a folder of its own per stage."""

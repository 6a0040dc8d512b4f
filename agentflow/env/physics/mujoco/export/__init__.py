"""Models of the MuJoCo engine as files for other users of MuJoCo."""

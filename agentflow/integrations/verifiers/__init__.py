"""verifiers: environments for training and evaluation, offered by `agentflow_verifiers`."""

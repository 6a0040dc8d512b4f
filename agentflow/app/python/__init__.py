"""What Python programs call: `agentflow.design`, `check`, `simulate`."""

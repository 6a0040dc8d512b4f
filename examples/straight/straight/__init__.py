"""Parts of one's own for agentflow; docs/tutorials/your-own-part.md explains them."""

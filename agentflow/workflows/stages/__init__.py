"""The stages that workflows are made of."""

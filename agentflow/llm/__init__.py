"""Language models: one asynchronous client interface; implementations wrap each other."""

"""What answers look like, as models: the OpenAPI page declares them, tests hold the answers to them."""

"""The shape of the unloaded bundle: how it tapers, along which curve it lies, where it forks."""

"""How fast this package and its peers are."""

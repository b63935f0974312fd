"""Laws outside the catalogue of effects: a diagnosis should say that it does not know them."""

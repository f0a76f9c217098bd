"""Back-ends: each turns the model into the texts of one target, independent of the others."""

"""Back-ends: each generates the output of one target, independently of the others."""

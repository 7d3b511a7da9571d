"""Control as a quadratic program (§4, Appendices B and C of the document)."""

"""The engine `paper`: the published Algorithm 1, as readable as the paper. It alone imports filterpy."""

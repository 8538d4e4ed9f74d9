"""BioTac fingertips: channels, contact points and learned normals."""

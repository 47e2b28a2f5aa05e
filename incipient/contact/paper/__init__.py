"""The paper's criteria of incipient motion, with its modified Coulomb friction: the first of two judges."""

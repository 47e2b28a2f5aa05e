"""What the plan of a scene is made of: the base flow, conditions, what is meshed and how finely."""

"""From the scene to the plan: effects and reasons, the undisturbed stream, conditions, what to draw and how fine."""

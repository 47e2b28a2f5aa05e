"""From the scene to the plan: effects and reasons, the base flow, conditions, what to draw and how fine."""

"""The article's method: what it claims, and the step at which it loses an overlap."""

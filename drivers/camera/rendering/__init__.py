"""Pictures of markers and boards as a camera would take them, drawn without a physics engine."""

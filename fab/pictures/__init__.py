"""Pictures of parts without a screen."""

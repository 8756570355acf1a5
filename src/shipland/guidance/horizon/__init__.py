"""The pilot `horizon`: one estimate from the first box to contact, references as trajectories, gains from the model."""

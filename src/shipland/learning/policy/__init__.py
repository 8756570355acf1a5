"""The last phase of a landing as a batched model, and policies trained through it."""

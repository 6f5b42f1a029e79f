"""The shapes that a top may have, each with its fit."""

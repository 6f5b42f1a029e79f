"""What tests make: tables, rooms, recordings, runs."""

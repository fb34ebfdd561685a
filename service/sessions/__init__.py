"""Live sessions: engines in processes of their own, each driven over one WebSocket at a time (docs/sessions.md)."""

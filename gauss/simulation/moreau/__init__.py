"""Time stepping: impacts and friction within steps of one length."""

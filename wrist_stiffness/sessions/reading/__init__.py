"""From recordings and tables of this wrist to measured sessions."""

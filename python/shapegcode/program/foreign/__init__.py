"""Programs in the words of controls other than FANUC's, read into plain programs in FANUC's words."""

"""Programs for controls other than FANUC's, translated into expanded programs in FANUC's dialect."""

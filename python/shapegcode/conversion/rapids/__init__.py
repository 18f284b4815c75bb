"""Rapids written as shaped moves where that settles the table sooner."""

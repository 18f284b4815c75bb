"""Rapids written as shaped moves where the vibration then settles sooner."""

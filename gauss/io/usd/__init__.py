"""USD files of rigid articulations, read with their loops."""

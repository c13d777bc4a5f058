"""Questions with committed answers: each script prints and writes what it measured."""

"""Steps of integrators as traced functions of one system, from which compiled loops are made."""

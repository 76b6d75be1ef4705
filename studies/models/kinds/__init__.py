"""One module per kind of compensation model; `studies.models` says what each must provide."""

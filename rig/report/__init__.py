"""Reports: HTML files that open without a network; of one flight here, ``page`` for those of other rooms."""

"""Quality-diversity search: an archive of the best candidates of different kinds."""

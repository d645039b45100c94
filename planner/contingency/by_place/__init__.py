"""The bound whose memory depends on the place (ng-route relaxation, Baldacci, Mingozzi and Roberti 2011)."""

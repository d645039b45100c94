"""The REST interface: routers, schemas, problem documents, event stream."""

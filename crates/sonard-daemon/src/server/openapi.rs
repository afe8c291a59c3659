//! Route definitions with their OpenAPI description, so that document and server always agree.

use axum::{
    Router,
    handler::Handler,
    http::Method,
    routing::{MethodFilter, on},
};
use schemars::{JsonSchema, Schema, SchemaGenerator, generate::SchemaSettings};
use serde_json::{Map, Value, json};
use sonard_api::Problem;

use super::Api;

type SchemaOf = fn(&mut SchemaGenerator) -> Schema;

/// Operation of the API: route, handler and description.
pub(super) struct Route {
    method: Method,
    path: &'static str,
    about: &'static str,
    /// Location, name, schema and description of each parameter.
    parameters: Vec<(&'static str, &'static str, Value, &'static str)>,
    body: Option<SchemaOf>,
    responses: Vec<(u16, &'static str, &'static str, Option<SchemaOf>)>,
    router: Router<Api>,
}

impl Route {
    pub(super) fn get<H, T>(path: &'static str, handler: H, about: &'static str) -> Self
    where
        H: Handler<T, Api>,
        T: 'static,
    {
        Self::new(Method::GET, MethodFilter::GET, path, handler, about)
    }

    pub(super) fn post<H, T>(path: &'static str, handler: H, about: &'static str) -> Self
    where
        H: Handler<T, Api>,
        T: 'static,
    {
        Self::new(Method::POST, MethodFilter::POST, path, handler, about)
    }

    pub(super) fn put<H, T>(path: &'static str, handler: H, about: &'static str) -> Self
    where
        H: Handler<T, Api>,
        T: 'static,
    {
        Self::new(Method::PUT, MethodFilter::PUT, path, handler, about)
    }

    pub(super) fn delete<H, T>(path: &'static str, handler: H, about: &'static str) -> Self
    where
        H: Handler<T, Api>,
        T: 'static,
    {
        Self::new(Method::DELETE, MethodFilter::DELETE, path, handler, about)
    }

    fn new<H, T>(
        method: Method,
        filter: MethodFilter,
        path: &'static str,
        handler: H,
        about: &'static str,
    ) -> Self
    where
        H: Handler<T, Api>,
        T: 'static,
    {
        let router = Router::new().route(path, on(filter, handler));
        let (parameters, responses) = (Vec::new(), Vec::new());
        Self { method, path, about, parameters, body: None, responses, router }
    }

    /// Adds a JSON request body.
    pub(super) fn accepts<T: JsonSchema>(mut self) -> Self {
        self.body = Some(|generator| generator.subschema_for::<T>());
        self
    }

    /// Adds a parameter in the `query`, `path` or `header`.
    pub(super) fn parameter(
        mut self,
        place: &'static str,
        name: &'static str,
        schema: Value,
        about: &'static str,
    ) -> Self {
        self.parameters.push((place, name, schema, about));
        self
    }

    /// Adds a JSON response.
    pub(super) fn responds<T: JsonSchema>(self, status: u16, about: &'static str) -> Self {
        self.responds_as::<T>(status, "application/json", about)
    }

    /// Adds a response of items (lines, events) of a type.
    pub(super) fn responds_as<T: JsonSchema>(
        mut self,
        status: u16,
        media: &'static str,
        about: &'static str,
    ) -> Self {
        self.responses.push((
            status,
            media,
            about,
            Some(|generator| generator.subschema_for::<T>()),
        ));
        self
    }

    /// Adds a text response.
    pub(super) fn responds_text(
        mut self,
        status: u16,
        media: &'static str,
        about: &'static str,
    ) -> Self {
        self.responses.push((status, media, about, None));
        self
    }
}

/// Builds the router of all endpoints.
pub(super) fn router(endpoints: Vec<Route>) -> Router<Api> {
    endpoints.into_iter().fold(Router::new(), |router, endpoint| router.merge(endpoint.router))
}

/// Builds the OpenAPI 3.1 document of all endpoints.
pub(super) fn document(endpoints: &[Route]) -> Value {
    let settings = SchemaSettings::draft2020_12().for_serialize().with(|settings| {
        settings.definitions_path = "/components/schemas".into();
        settings.meta_schema = None;
    });
    let mut generator = settings.into_generator();
    // Optional fields differ between requests and responses, so the schemas of request bodies are
    // inlined.
    let mut bodies = SchemaSettings::draft2020_12()
        .with(|settings| {
            settings.inline_subschemas = true;
            settings.meta_schema = None;
        })
        .into_generator();
    let problem = generator.subschema_for::<Problem>();
    let mut paths = Map::new();
    for endpoint in endpoints {
        let operation = operation(endpoint, &problem, &mut generator, &mut bodies);
        let path = paths.entry(endpoint.path).or_insert_with(|| json!({}));
        path[endpoint.method.as_str().to_ascii_lowercase()] = operation;
    }
    json!({
        "openapi": "3.1.0",
        "info": {
            "title": "sonard",
            "version": env!("CARGO_PKG_VERSION"),
            "description": "Status, control and live readings of an ultrasonic ranger. Served on a \
                unix socket, and over loopback TCP if that is enabled; there, writes need a bearer \
                token, and foreign Host or Origin headers are rejected.",
            "license": {"name": "MIT OR Apache-2.0"},
        },
        "servers": [{"url": "/"}],
        "paths": paths,
        "components": {
            "schemas": generator.take_definitions(true),
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
    })
}

#[expect(clippy::indexing_slicing, reason = "a JSON object takes any key")]
fn operation(
    endpoint: &Route,
    problem: &Schema,
    generator: &mut SchemaGenerator,
    bodies: &mut SchemaGenerator,
) -> Value {
    let mut responses = Map::new();
    for (status, media, about, schema) in &endpoint.responses {
        let content = match schema {
            Some(schema) => json!({ "schema": schema(generator) }),
            None => json!({ "schema": {"type": "string"} }),
        };
        let response = responses
            .entry(status.to_string())
            .or_insert_with(|| json!({ "description": about, "content": {} }));
        response["content"][*media] = content;
    }
    responses.insert(
        "default".into(),
        json!({
            "description": "Rejected, with the reason: 400 or 422 malformed or out of range, 401 or \
                403 not allowed, 404 not found, 408 timeout, 409 conflict with the current state \
                (scene, motor, pending requests), 413 too large, 429 too many requests, 503 too many clients",
            "content": {"application/json": {"schema": problem}},
        }),
    );
    let parameters: Vec<Value> = endpoint
        .parameters
        .iter()
        .map(|(place, name, schema, about)| {
            json!({
                "in": place, "name": name, "schema": schema, "description": about,
                "required": *place == "path",
            })
        })
        .collect();
    let mut operation = json!({
        "summary": endpoint.about,
        "operationId": operation_id(endpoint),
        "parameters": parameters,
        "responses": responses,
    });
    if let Some(body) = endpoint.body {
        let mut schema = body(bodies).to_value();
        close_schema(&mut schema);
        operation["requestBody"] =
            json!({ "required": true, "content": {"application/json": {"schema": schema}} });
    }
    if endpoint.method != Method::GET {
        operation["security"] = json!([{}, {"token": []}]);
    }
    operation
}

/// Closes the schema of a request body: unknown fields are rejected, and integers fit their type.
fn close_schema(schema: &mut Value) {
    if let Value::Object(schema) = schema {
        if schema.contains_key("properties") {
            schema.entry("additionalProperties").or_insert(Value::Bool(false));
        }
        if schema.get("format").is_some_and(|format| format == "uint32") {
            schema.entry("maximum").or_insert_with(|| u32::MAX.into());
        }
        schema.values_mut().for_each(close_schema);
    }
    if let Value::Array(schemas) = schema {
        schemas.iter_mut().for_each(close_schema);
    }
}

/// Returns the operation id, such as `get_v1_logs_name` for `GET /v1/logs/{name}`.
fn operation_id(endpoint: &Route) -> String {
    let words = endpoint.path.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    format!("{}_{}", endpoint.method.as_str().to_ascii_lowercase(), words.join("_"))
}

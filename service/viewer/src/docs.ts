// The API's documentation, from our own copy of Swagger UI.
import "swagger-ui-dist/swagger-ui.css";
// @ts-expect-error: the bundle ships no types
import SwaggerUI from "swagger-ui-dist/swagger-ui-es-bundle.js";

SwaggerUI({ url: "openapi.json", dom_id: "#swagger", deepLinking: true, validatorUrl: null });

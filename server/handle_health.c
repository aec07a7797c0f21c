#include "service.h"
#include <stdio.h>
#include <string.h>

static lathe_status build_health(lathe_body *body, void *context, lathe_error *err) {
    static const char text[] = "{\"status\":\"ok\"}";
    (void)context, (void)err;
    body->bytes = (const uint8_t *)text;
    body->size = sizeof text - 1;
    return LATHE_OK;
}

enum MHD_Result lathe__handle_health(lathe_request *request) {
    lathe_recipe recipe = {.key = "healthz", .type = "application/json", .build = build_health};
    return lathe__respond(request, &recipe);
}

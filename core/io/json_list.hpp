#pragma once
// Lists in JSON objects, made so that a request for memory may fail.

#include <utility>

namespace isowave::core {

/// Appends a value to the list object[key], which is made if the object has none. With
/// `object[key].push_back()` nlohmann's library (3.11.2) ends the process if there is no memory for
/// a new list. The same holds for `json object; object[key] = ...`: begin with json::object().
///
/// object  an object, or a value that holds one; a list that it makes is empty if this throws
/// Throws  std::bad_alloc
template <typename Json>
void add_to_list(Json &object, const char *key, Json value) {
  Json &list = object[key];
  if (list.is_null()) list = Json::array();
  list.push_back(std::move(value));
}

}  // namespace isowave::core

#include "shapegcode/plant/ode.hpp"

#include <cmath>
#include <cstdlib>
#include <exception>
#include <limits>
#include <new>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

using Eigen::VectorXd;

constexpr long most_steps_per_advance = 1'000'000;
constexpr double no_stop = std::numeric_limits<double>::max();
constexpr int recoverable = 1;
constexpr int unrecoverable = -1;

// One owner per SUNDIALS object; each is freed by its own function.
struct FreeContext {
  void operator()(SUNContext context) const noexcept { SUNContext_Free(&context); }
};
struct FreeVector {
  void operator()(N_Vector vector) const noexcept { N_VDestroy(vector); }
};
struct FreeMatrix {
  void operator()(SUNMatrix matrix) const noexcept { SUNMatDestroy(matrix); }
};
struct FreeSolver {
  void operator()(SUNLinearSolver solver) const noexcept { SUNLinSolFree(solver); }
};
struct FreeCvode {
  void operator()(void* memory) const noexcept { CVodeFree(&memory); }
};
using Context = std::unique_ptr<std::remove_pointer_t<SUNContext>, FreeContext>;
using Vector = std::unique_ptr<std::remove_pointer_t<N_Vector>, FreeVector>;
using Matrix = std::unique_ptr<std::remove_pointer_t<SUNMatrix>, FreeMatrix>;
using LinearSolver = std::unique_ptr<std::remove_pointer_t<SUNLinearSolver>, FreeSolver>;
using Cvode = std::unique_ptr<void, FreeCvode>;

std::string flag_name(int flag) {
  const std::unique_ptr<char, decltype(&std::free)> name(CVodeGetReturnFlagName(flag), &std::free);
  return name ? name.get() : std::to_string(flag);
}

/// Keeps CVODE's own words out of stderr: they are in the Error.
void keep_silent(int, const char*, const char*, char*, void*) {}

Eigen::Map<VectorXd> map_of(N_Vector vector) { return {N_VGetArrayPointer(vector), N_VGetLength(vector)}; }

}  // namespace

struct OdeSolver::Impl {
  Rhs rhs;
  Jacobian jacobian;
  VectorXd state;
  double time = 0.0;
  bool failed = false;
  long steps_before_restart = 0;
  long evaluations = 0;
  std::exception_ptr thrown;  // by rhs or jacobian, kept while C code is on the stack

  // Freed in reverse order: the context last.
  Context context;
  Vector y;
  Matrix matrix;
  LinearSolver linear_solver;
  Cvode cvode;

  static int call_rhs(realtype t, N_Vector y, N_Vector rate, void* self) noexcept;
  static int call_jacobian(realtype t, N_Vector y, N_Vector rate, SUNMatrix jacobian, void* self, N_Vector, N_Vector,
                           N_Vector) noexcept;

  void check(int flag, const char* call) {
    if (flag >= 0) return;
    failed = true;
    if (thrown) std::rethrow_exception(std::exchange(thrown, nullptr));
    double reached = time;
    if (cvode) CVodeGetCurrentTime(cvode.get(), &reached);
    std::ostringstream message;
    message.precision(17);
    message << call << " failed with " << flag_name(flag) << " at t = " << reached << " s";
    throw Error(ErrorKind::numeric, message.str());
  }
  [[nodiscard]] long steps_since_restart() const noexcept {
    long count = 0;
    CVodeGetNumSteps(cvode.get(), &count);
    return count;
  }
};

int OdeSolver::Impl::call_rhs(realtype t, N_Vector y, N_Vector rate, void* self_pointer) noexcept {
  auto& self = *static_cast<Impl*>(self_pointer);
  try {
    ++self.evaluations;
    Eigen::Map<VectorXd> result = map_of(rate);
    self.rhs(t, map_of(y), result);
    return result.allFinite() ? 0 : recoverable;
  } catch (...) {
    self.thrown = std::current_exception();
    return unrecoverable;
  }
}

int OdeSolver::Impl::call_jacobian(realtype t, N_Vector y, N_Vector, SUNMatrix jacobian, void* self_pointer, N_Vector,
                                   N_Vector, N_Vector) noexcept {
  auto& self = *static_cast<Impl*>(self_pointer);
  try {
    Eigen::Map<Eigen::MatrixXd> result(SUNDenseMatrix_Data(jacobian), SUNDenseMatrix_Rows(jacobian),
                                       SUNDenseMatrix_Columns(jacobian));
    result.setZero();
    self.jacobian(t, map_of(y), result);
    return result.allFinite() ? 0 : recoverable;
  } catch (...) {
    self.thrown = std::current_exception();
    return unrecoverable;
  }
}

OdeSolver::OdeSolver(Rhs rhs, Jacobian jacobian, const VectorXd& y0, double t0, double rtol, double atol)
    : OdeSolver(std::move(rhs), std::move(jacobian), y0, t0, rtol, VectorXd(VectorXd::Constant(y0.size(), atol))) {}

OdeSolver::OdeSolver(Rhs rhs, Jacobian jacobian, const VectorXd& y0, double t0, double rtol, const VectorXd& atol)
    : impl_(std::make_unique<Impl>()) {
  if (!rhs || !jacobian) throw Error(ErrorKind::argument, "an initial value problem needs a right side and a Jacobian");
  if (y0.size() == 0 || !y0.allFinite() || !std::isfinite(t0)) {
    throw Error(ErrorKind::argument,
                "initial state of " + std::to_string(y0.size()) + " values must be finite and not empty");
  }
  if (!std::isfinite(rtol) || !(rtol > 0.0)) {
    throw Error(ErrorKind::argument, "relative tolerance " + std::to_string(rtol) + " must be above 0");
  }
  if (atol.size() != y0.size() || !atol.allFinite() || !(atol.minCoeff() >= 0.0)) {
    throw Error(ErrorKind::argument, "absolute tolerances must be one per unknown, finite and not below 0");
  }
  Impl& self = *impl_;
  self.rhs = std::move(rhs);
  self.jacobian = std::move(jacobian);
  self.state = y0;
  self.time = t0;

  SUNContext context = nullptr;
  self.check(SUNContext_Create(nullptr, &context), "SUNContext_Create");
  self.context.reset(context);
  const auto size = static_cast<sunindextype>(y0.size());
  self.y.reset(N_VNew_Serial(size, context));
  const Vector tolerances(N_VNew_Serial(size, context));
  self.matrix.reset(SUNDenseMatrix(size, size, context));
  self.cvode.reset(CVodeCreate(CV_BDF, context));
  if (!self.y || !tolerances || !self.matrix || !self.cvode) throw std::bad_alloc();
  self.linear_solver.reset(SUNLinSol_Dense(self.y.get(), self.matrix.get(), context));
  if (!self.linear_solver) throw std::bad_alloc();

  map_of(self.y.get()) = y0;
  map_of(tolerances.get()) = atol;
  void* const cvode = self.cvode.get();
  self.check(CVodeSetErrHandlerFn(cvode, keep_silent, nullptr), "CVodeSetErrHandlerFn");
  self.check(CVodeInit(cvode, &Impl::call_rhs, t0, self.y.get()), "CVodeInit");
  self.check(CVodeSetUserData(cvode, &self), "CVodeSetUserData");
  self.check(CVodeSVtolerances(cvode, rtol, tolerances.get()), "CVodeSVtolerances");
  self.check(CVodeSetLinearSolver(cvode, self.linear_solver.get(), self.matrix.get()), "CVodeSetLinearSolver");
  self.check(CVodeSetJacFn(cvode, &Impl::call_jacobian), "CVodeSetJacFn");
  self.check(CVodeSetMaxNumSteps(cvode, most_steps_per_advance), "CVodeSetMaxNumSteps");
}

OdeSolver::~OdeSolver() = default;
OdeSolver::OdeSolver(OdeSolver&&) noexcept = default;
OdeSolver& OdeSolver::operator=(OdeSolver&&) noexcept = default;

const VectorXd& OdeSolver::advance(double t, bool stop_exactly) {
  Impl& self = *impl_;
  if (self.failed) {
    throw Error(ErrorKind::numeric, "the solver failed at t = " + std::to_string(self.time) + " s; restart it first");
  }
  if (!(t >= self.time) || !std::isfinite(t)) {
    std::ostringstream message;
    message.precision(17);
    message << "cannot advance to t = " << t << " s, the solver is at " << self.time << " s";
    throw Error(ErrorKind::argument, message.str());
  }
  if (t == self.time) return self.state;
  void* const cvode = self.cvode.get();
  double stepped_to = self.time;
  self.check(CVodeGetCurrentTime(cvode, &stepped_to), "CVodeGetCurrentTime");
  // If an earlier call stepped past t already, t is interpolated and nothing is left to stop. A stop that was reached
  // stays set in CVODE and would end the next call at once: so every call states its own.
  self.check(CVodeSetStopTime(cvode, stop_exactly && stepped_to < t ? t : no_stop), "CVodeSetStopTime");
  double reached = self.time;
  self.check(CVode(cvode, t, self.y.get(), &reached, CV_NORMAL), "CVode");
  self.state = map_of(self.y.get());
  self.time = t;
  return self.state;
}

void OdeSolver::restart(const VectorXd& y) { restart(y, impl_->time); }

void OdeSolver::restart(const VectorXd& y, double t) {
  Impl& self = *impl_;
  if (y.size() != self.state.size() || !y.allFinite() || !std::isfinite(t)) {
    throw Error(ErrorKind::argument, "restart needs " + std::to_string(self.state.size()) + " finite values, got " +
                                         std::to_string(y.size()));
  }
  void* const cvode = self.cvode.get();
  self.steps_before_restart += self.steps_since_restart();
  self.state = y;
  self.time = t;
  self.thrown = nullptr;
  map_of(self.y.get()) = y;
  self.check(CVodeReInit(cvode, t, self.y.get()), "CVodeReInit");
  self.failed = false;
}

double OdeSolver::time() const noexcept { return impl_->time; }
const VectorXd& OdeSolver::state() const noexcept { return impl_->state; }
long OdeSolver::steps() const noexcept { return impl_->steps_before_restart + impl_->steps_since_restart(); }
long OdeSolver::rhs_evaluations() const noexcept { return impl_->evaluations; }

}  // namespace shapegcode
